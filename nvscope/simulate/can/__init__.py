"""CAN in a scenario: its tables, its buses in time, and the truth about them."""
