"""Parameter files of drives and motion controllers: from them to stages, and back to what is typed into a drive."""
