"""WebVisu as client and as controller: what is said without sockets, and sockets around that."""
