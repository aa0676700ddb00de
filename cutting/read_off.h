#pragma once

#include "cutting/triangle_soup.h"

namespace abbe::cutting {

/// An OFF in text, its faces with or without a colour.
/// @throws BadInput for anything else
Soup read_off(const MeshSource& source);

}  // namespace abbe::cutting
