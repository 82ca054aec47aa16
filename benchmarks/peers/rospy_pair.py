"""ROS 1 in Python: rospy topics of std_msgs/UInt8MultiArray over TCP without Nagle's delay. Needs a running master."""

import queue

import rospy  # pyright: ignore[reportMissingImports]
from std_msgs.msg import UInt8MultiArray  # pyright: ignore[reportMissingImports]


def open_link(side, folder):
    """Open one side: a node with a publisher and a subscriber whose callback passes messages to the receiver."""
    rospy.init_node(f"pair_{side}", anonymous=True, disable_signals=True)
    incoming, outgoing = ("request", "reply") if side == "echo" else ("reply", "request")
    received = queue.SimpleQueue()
    rospy.Subscriber(
        f"/pair/{incoming}", UInt8MultiArray, lambda sample: received.put(bytes(sample.data)), tcp_nodelay=True
    )
    publisher = rospy.Publisher(f"/pair/{outgoing}", UInt8MultiArray, tcp_nodelay=True, queue_size=10)

    def send(payload):
        publisher.publish(UInt8MultiArray(data=payload))

    return send, received.get, lambda: rospy.signal_shutdown("done")
