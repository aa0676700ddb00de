#include "sim/commands/compare_command.h"

#include <memory>

#include "sim/commands/outcome_text.h"

namespace abbe::sim {

Command compare_command(Common& common) {
  using Files = std::vector<std::filesystem::path>;
  const auto compensators = std::make_shared<Files>();
  return {"compare", "Cut error-free, uncompensated and every compensator of the scene",
          scene_options(common, {result_folder_option(common), force_option(common),
                                 trust_option(common), compensator_option(*compensators)}),
          [compensators, &common] {
            const RunOptions options = run_options(common, *compensators);
            return print_outcome(common, options, compare(common.scene, options));
          }};
}

}  // namespace abbe::sim
