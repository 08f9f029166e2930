"""The variables in the telegrams of defined lists: last values, changes, moments, hops, samples."""
