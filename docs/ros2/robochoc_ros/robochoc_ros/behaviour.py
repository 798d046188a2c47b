"""A behaviour for py_trees: a team decides, and the tree goes on when it has.

`python3 -m robochoc_ros.behaviour hangar` ticks a tree of this one behaviour, as a node of ROS 2.
"""

import sys
from collections.abc import Callable
from typing import Any

import py_trees
from py_trees.common import Access, Status


class Decide(py_trees.behaviour.Behaviour):
    """Asks `/robochoc/decide`. It is RUNNING until the team has decided; the assignment is then on the blackboard.

    Args:
        name: The behaviour's name.
        ask: Sends a request, and returns a future for the answer: `call_async` of a client.
        request: What is asked: a `robochoc_msgs/srv/Decide` request.
        cancel: Asks `/robochoc/cancel`. It is called when the tree does not want the decision any more.
        key: Where on the blackboard the assignment goes, a dictionary.
    """

    def __init__(
        self,
        name: str,
        ask: Callable[[Any], Any],
        request: object,
        cancel: Callable[[], object],
        key: str = "assignment",
    ) -> None:
        super().__init__(name)
        self.ask, self.request, self.cancel, self.key = ask, request, cancel, key
        self.board = self.attach_blackboard_client(name)
        self.board.register_key(key, access=Access.WRITE)
        self.answer: Any = None

    def initialise(self) -> None:
        """Ask."""
        self.answer = self.ask(self.request)

    def update(self) -> Status:
        """Return whether the team has decided."""
        if not self.answer.done():
            return Status.RUNNING
        told = self.answer.result()
        self.feedback_message = told.message
        if not told.success:
            return Status.FAILURE
        self.board.set(self.key, dict(zip(told.variables, told.values, strict=True)))
        return Status.SUCCESS

    def terminate(self, new_status: Status) -> None:
        """Cancel what is not wanted any more: another branch of the tree has become more important."""
        if new_status is Status.INVALID and self.answer is not None and not self.answer.done():
            self.cancel()


def main(team: str) -> None:
    """Tick a tree until the team has decided."""
    import rclpy  # noqa: PLC0415 - the behaviour itself needs no ROS
    from robochoc_msgs.srv import Decide as DecideService  # noqa: PLC0415 - as above
    from std_srvs.srv import Trigger  # noqa: PLC0415 - as above

    rclpy.init()
    node = rclpy.create_node("decide_tree")
    decide = node.create_client(DecideService, "/robochoc/decide")
    cancel = node.create_client(Trigger, "/robochoc/cancel")
    decide.wait_for_service()
    request = DecideService.Request(team=team)
    root = Decide("decide", decide.call_async, request, lambda: cancel.call_async(Trigger.Request()))
    tree = py_trees.trees.BehaviourTree(root)
    tree.tick()
    while root.status is Status.RUNNING:
        rclpy.spin_once(node, timeout_sec=0.1)
        tree.tick()
    told = [root.status.value, root.feedback_message]
    if root.status is Status.SUCCESS:
        told += [f"{name} = {value}" for name, value in root.board.get(root.key).items()]
    sys.stdout.write("\n".join([*told, ""]))
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main(sys.argv[1])
