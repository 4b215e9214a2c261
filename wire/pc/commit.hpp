// SPDX-License-Identifier: MIT
// The commit that all of this was built from, "-dirty" where files have changed since; found with each build.
#pragma once

namespace wire::pc {

extern const char commit[];

}  // namespace wire::pc
