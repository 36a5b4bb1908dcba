"""What a bag's objects are in a camera's image, as KITTI labels them."""
