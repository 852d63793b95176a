"""Camera models, one file each, and what follows from any of them."""
