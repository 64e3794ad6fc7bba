"""Image files: OpenEXR, Radiance HDR and PNG."""
