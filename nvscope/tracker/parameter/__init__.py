"""The Parameter Manager: who asked whom for which value, and what came of it."""
