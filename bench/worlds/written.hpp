/* What it is for: the files that a campaign leaves.
 * What it owns: nothing.
 * What it never does: say what is in them. */
#ifndef WORLDS_WRITTEN_HPP
#define WORLDS_WRITTEN_HPP

#include <fstream>
#include <stdexcept>
#include <string>

/* Where a path is given. Throws std::runtime_error where it cannot be written. */
inline void write(const std::string &path, const std::string &content)
{
    if (path.empty())
        return;
    std::ofstream file(path);
    file << content << std::flush;
    if (!file)
        throw std::runtime_error(path + ": cannot be written");
}

#endif
