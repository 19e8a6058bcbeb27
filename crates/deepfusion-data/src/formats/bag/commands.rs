//! Recognises topics with commands to a vehicle instead of measurements: ROS 2's controllers publish both with the same message type.

/// Words in the names of topics with commands.
const WORDS: [&str; 7] = [
    "cmd", "command", "commands", "setpoint", "target", "teleop", "joy",
];
/// Parts of names that may continue with other letters.
const PARTS: [&str; 2] = ["cmd_vel", "nav_vel"];

/// Whether a topic has commands, according to its name.
pub(super) fn is_command(name: &str) -> bool {
    let name = name.to_lowercase();
    let mut words = name.split(['/', '_']);
    words.any(|word| WORDS.contains(&word)) || PARTS.iter().any(|part| name.contains(part))
}

#[cfg(test)]
mod tests {
    use super::is_command;

    #[test]
    fn commands_are_recognised_by_words_in_their_names() {
        for name in [
            "/diff_drive_controller/cmd_vel",
            "/ackermann_cmd",
            "/nav_vel_stamped",
            "/base/cmd_velocity",
            "/Teleop/drive",
            "/steering/setpoint",
            "/joy_stick/twist",
        ] {
            assert!(is_command(name), "{name}");
        }
        for name in [
            "/vehicle/steering",
            "/vehicle/twist",
            "/enjoy/speed",
            "/drive",
        ] {
            assert!(!is_command(name), "{name}");
        }
    }
}
