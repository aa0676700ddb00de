#include "sim/commands/exit_code.h"

#include <new>

#include "sim/compensation/plug_in.h"
#include "sim/cut/collision_events.h"
#include "sim/dialects/bad_program.h"
#include "sim/files/output_failure.h"
#include "sim/files/progress.h"
#include "sim/files/standard_output.h"
#include "sim/files/terminal.h"
#include "sim/scene/bad_scene.h"

namespace abbe::sim {

Exit exit_code(const std::function<Exit()>& program) {
  try {
    const Exit code = program();
    flush_output();
    return code;
  } catch (const Interrupted&) {
    print(stderr, "abbe: interrupted\n");
    return Exit::Interrupted;
  } catch (const BadUsage& fault) {
    print(stderr, "abbe: {}\n", fault.what());
    return Exit::Usage;
  } catch (const BadScene& faults) {
    for (const BadInput& fault : faults.faults) print(stderr, "abbe: {}\n", fault.what());
    return Exit::Input;
  } catch (const dialects::BadProgram& faults) {
    for (const BadInput& fault : faults.faults) print(stderr, "abbe: {}\n", fault.what());
    return Exit::Input;
  } catch (const BadInput& fault) {
    print(stderr, "abbe: {}\n", fault.what());
    return Exit::Input;
  } catch (const CollisionStop& stop) {
    print(stderr, "abbe: {}\n", stop.what());
    return Exit::LimitExceeded;
  } catch (const compensation::PlugInFailure& failure) {
    print(stderr, "abbe: {}\n", Lines(failure.what()));
    return Exit::PlugIn;
  } catch (const OutputFailure& failure) {
    print(stderr, "abbe: {}\n", failure.what());
    return Exit::Output;
  } catch (const std::bad_alloc&) {
    print(stderr, "abbe: not enough memory for this scene\n");
    return Exit::Numerical;
  } catch (const std::exception& failure) {
    print(stderr, "abbe: {}\n", failure.what());
    return Exit::Numerical;
  }
}

}  // namespace abbe::sim
