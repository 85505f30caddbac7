"""What a training sees: samples, batches and augmentation."""
