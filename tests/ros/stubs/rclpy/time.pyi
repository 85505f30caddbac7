import builtin_interfaces.msg

class Time:
    @classmethod
    def from_msg(cls, msg: builtin_interfaces.msg.Time) -> Time: ...
