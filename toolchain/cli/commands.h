// One function per command of figurine-train: adds the subcommand, its options and the callback
// that runs it. Callbacks throw InputError on bad input.
#pragma once

namespace CLI {
class App;
}

namespace figurine::cli {

// All of them, and what the program itself has. argv: for --force-threads, which is looked for
// before options are read.
void add_commands(CLI::App& app, int argc, const char* const* argv);

void add_body_command(CLI::App& app);
void add_motion_command(CLI::App& app);
void add_capture_command(CLI::App& app);
void add_check_capture_command(CLI::App& app);
void add_avatar_command(CLI::App& app);
void add_basis_command(CLI::App& app);
void add_pack_command(CLI::App& app);
void add_known_poses_command(CLI::App& app);
void add_population_command(CLI::App& app);
void add_sampler_command(CLI::App& app);
void add_features_command(CLI::App& app);
void add_evaluate_command(CLI::App& app);
void add_evaluate_members_command(CLI::App& evaluate);  // below evaluate, as the others
void add_evaluate_distance_command(CLI::App& evaluate);
void add_evaluate_poses_command(CLI::App& evaluate);
void add_evaluate_generation_command(CLI::App& evaluate);
void add_evaluate_sampling_command(CLI::App& evaluate);
void add_evaluate_features_command(CLI::App& evaluate);

}  // namespace figurine::cli
