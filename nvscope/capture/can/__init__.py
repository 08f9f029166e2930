"""CAN logs, whatever program wrote them."""
