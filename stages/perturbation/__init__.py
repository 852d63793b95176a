"""Images, features and odometry made worse on purpose, to test robustness."""
