"""The light-depth map: file, building, importance sampling, median cut."""
