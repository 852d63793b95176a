"""Images into panoramas and perspective windows: one file per way, whatever the camera."""
