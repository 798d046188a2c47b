// The node Decide: a goal of the action /robochoc/decide. It is RUNNING until the team has decided. Then it is SUCCESS,
// with the assignment in its output ports, or FAILURE. If the tree halts the node, the goal is cancelled.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "behaviortree_ros2/bt_action_node.hpp"
#include "behaviortree_ros2/plugins.hpp"
#include "robochoc_msgs/action/decide.hpp"

class Decide : public BT::RosActionNode<robochoc_msgs::action::Decide>
{
public:
  Decide(const std::string & name, const BT::NodeConfig & config, const BT::RosNodeParams & params)
  : BT::RosActionNode<robochoc_msgs::action::Decide>(name, config, params)
  {
  }

  static BT::PortsList providedPorts()
  {
    return providedBasicPorts({
      BT::InputPort<std::string>("team", "", "The name of the team; may be empty if there is one"),
      BT::InputPort<std::string>("changes", "", "Changes of the problem, as JSON"),
      BT::InputPort<double>("timeout", 0.0, "Seconds; 0: as long as the server allows"),
      BT::OutputPort<std::vector<std::string>>("variables", "The variables of the assignment"),
      BT::OutputPort<std::vector<int64_t>>("values", "The values of the assignment"),
      BT::OutputPort<std::string>("cost", "The cost of the assignment, or of the best one so far"),
      BT::OutputPort<std::string>("message", "The verdict, or the error in the goal"),
    });
  }

  bool setGoal(Goal & goal) override
  {
    getInput("team", goal.team);
    getInput("changes", goal.changes);
    getInput("timeout", goal.timeout);
    return true;
  }

  BT::NodeStatus onFeedback(const std::shared_ptr<const Feedback> feedback) override
  {
    setOutput("cost", feedback->cost);
    return BT::NodeStatus::RUNNING;
  }

  BT::NodeStatus onResultReceived(const WrappedResult & result) override
  {
    setOutput("message", result.result->message);
    if (!result.result->success) {
      return BT::NodeStatus::FAILURE;
    }
    setOutput("cost", result.result->cost);
    setOutput("variables", result.result->variables);
    setOutput("values", std::vector<int64_t>(result.result->values.begin(), result.result->values.end()));
    return BT::NodeStatus::SUCCESS;
  }
};

CreateRosNodePlugin(Decide, "Decide");
