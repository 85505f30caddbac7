from std_msgs.msg import Header

class Image:
    header: Header
    height: int
    width: int
    encoding: str

class CameraInfo:
    header: Header

class PointCloud2:
    header: Header
