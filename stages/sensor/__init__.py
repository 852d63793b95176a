"""How well poses explain what is seen."""
