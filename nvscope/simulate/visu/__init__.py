"""Pages of web visualizations in simulated traffic: what they ask of controllers, and what comes of it."""
