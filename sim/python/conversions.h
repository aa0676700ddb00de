#pragma once

#include <string>
#include <vector>

#include <pybind11/pybind11.h>
#include <nlohmann/json_fwd.hpp>

#include "sim/files/progress.h"
#include "sim/scene/override.h"

/// What Python says in words of abbe, and back.
namespace abbe::python {

/// {"errors.scale": 2.0, "part.vertices": 20000}, or a list of such pairs, as `--set` has them.
/// @throws pybind11::type_error for a value that TOML has not
std::vector<sim::Override> overrides(const pybind11::object& set);

/// A callback `progress(text, fraction)`, below zero a remark, or None. In either case Ctrl-C ends
/// the work, and what the callback raises does.
sim::Progress progress(const pybind11::object& callback);

/// A dict of dicts, lists and numbers.
pybind11::object to_python(const nlohmann::ordered_json& json);

/// The file that a name means, which may be one of the library.
std::filesystem::path scene_file(const std::filesystem::path& name);

/// Registers what abbe throws.
void define_exceptions(pybind11::module_& module);

}  // namespace abbe::python
