"""Tests of what every protocol keeps, and of one that is invented here."""
