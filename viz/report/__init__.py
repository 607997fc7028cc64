"""Reports: one HTML file that holds everything it shows, for sending and for keeping."""
