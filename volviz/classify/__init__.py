"""What is shown how: presets, labels, Hounsfield units, and the suggestion for any volume."""
