"""From where to go to what the wheels shall do."""
