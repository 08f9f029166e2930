"""The one loop: batches are recognised and laid out once, and told to observers."""
