"""What a map that is learned while it is used may learn from, and when."""
