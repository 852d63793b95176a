"""How far apart two views of one place may be."""
