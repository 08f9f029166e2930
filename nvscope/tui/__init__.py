"""The screen: what is known of a plant, looked at while it runs."""
