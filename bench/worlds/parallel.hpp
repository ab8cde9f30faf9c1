/* What it is for: runs of a campaign on several threads.
 * What it owns: nothing.
 * What it never does: order results; each run writes its own place. */
#ifndef WORLDS_PARALLEL_HPP
#define WORLDS_PARALLEL_HPP

#include <atomic>
#include <thread>
#include <vector>

/* Calls work(item) once for each item, on so many threads; returns when all are done. */
template <typename Item, typename Work>
void in_parallel(std::vector<Item> &items, unsigned jobs, const Work &work)
{
    std::atomic<std::size_t> next{0};
    std::vector<std::thread> threads;
    for (unsigned j = 0; j < jobs; j++)
        threads.emplace_back([&] {
            for (std::size_t i = next++; i < items.size(); i = next++)
                work(items[i]);
        });
    for (std::thread &thread : threads)
        thread.join();
}

#endif
