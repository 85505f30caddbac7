"""What classes and depth from elsewhere share: networks that look at photos, files with a map for each photo, and how maps come to the pixels of a view."""
