"""Image files: OpenEXR and Radiance HDR, panoramas as cameras save them, and PNG."""
