"""Transactions: what was asked of a controller, and what became of it, whichever protocol that is."""
