//! First-principles xy-table in closed loop: plant, controllers, experiments
