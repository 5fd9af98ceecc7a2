"""What live and exported pages get packed: arrays, keyframes, and plots."""
