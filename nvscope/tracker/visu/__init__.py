"""WebVisu: what pages ask controllers for over HTTP, and what these answer."""
