"""Where packets come from while they are sent: interfaces, sockets, buses."""
