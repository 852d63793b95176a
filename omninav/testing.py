"""What a third party tests its stages with."""
