from std_msgs.msg import Header

class Detection3DArray:
    header: Header
