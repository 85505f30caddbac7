from std_msgs.msg import Header

class Vector3:
    x: float
    y: float
    z: float

class Quaternion:
    x: float
    y: float
    z: float
    w: float

class Transform:
    translation: Vector3
    rotation: Quaternion

class TransformStamped:
    header: Header
    child_frame_id: str
    transform: Transform
