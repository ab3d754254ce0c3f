"""From images to what is there: segmentation, regions, descriptors, recognition and geometry."""
