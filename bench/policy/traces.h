// What it is for: the runs behind the pictures of docs/driving.md, as CSV files.
// What it owns:   which runs those are. What it never does: draw.
#ifndef POLICY_TRACES_H
#define POLICY_TRACES_H

#include <cstdint>
#include <string>

namespace policy_bench
{

// Into an existing directory; std::runtime_error if a file cannot be written.
void write_traces(const std::string &directory, std::uint64_t seed);

} // namespace policy_bench
#endif
