"""Where drones fly, whatever tells them: missions, routes, and the simulated quadrotor."""
