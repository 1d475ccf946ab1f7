"""What all kernels share: compilation, rounding, scaling, small linear algebra, scratch memory."""
