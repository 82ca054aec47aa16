"""The messages on the bus and in the bags: ROS 2 definitions (*.msg), and the layouts and codecs derived from them."""
