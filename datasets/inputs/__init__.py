"""Network inputs, derived from recorded frames: warped, cached, augmented, batched. Only here is torch imported."""
