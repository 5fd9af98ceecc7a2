"""What is shown, as one page that needs no server."""
