"""The messages on the bus: ROS 2 definitions (*.msg) and the codec derived from them."""
