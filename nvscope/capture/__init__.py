"""Where packets come from and go to: capture files, one timeline of several."""
