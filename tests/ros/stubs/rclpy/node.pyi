from typing import Generic, TypeVar

Message = TypeVar("Message")

class Parameter:
    @property
    def value(self) -> str: ...

class Publisher(Generic[Message]):
    def publish(self, msg: Message | bytes) -> None: ...

class Node:
    def declare_parameter(self, name: str, value: str) -> Parameter: ...
    def create_publisher(self, msg_type: type[Message], topic: str, qos_profile: int) -> Publisher[Message]: ...
