"""What can be known of this machine and of the traffic that comes to it; no judgement."""
