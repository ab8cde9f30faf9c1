/* Every truncation of a valid file and thousands of seeded mutations: read or refused, never
 * anything else. */
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "../run_tests.h"

#include "scenario_file.h"

using namespace ninespring;

namespace
{

struct random_bytes {
    std::uint64_t state;
    std::uint32_t next()
    {
        state = state * 6364136223846793005U + 1442695040888963407U;
        return static_cast<std::uint32_t>(state >> 33U);
    }
};

/* Refused means one printable line that begins with the file's name. */
bool survives(const std::string &text, const std::function<void(const text_file &)> &read)
{
    try {
        read(make_text_file("f", text, 197));
        return true;
    } catch (const input_error &error) {
        const std::string message = error.what();
        TEST_ASSERT_TRUE_MESSAGE(message.compare(0, 2, "f:") == 0, message.c_str());
        for (const char c : message) {
            TEST_ASSERT_TRUE_MESSAGE(c >= ' ' && c <= '~', message.c_str());
        }
        return false;
    }
}

void attack(const std::string &valid, const std::function<void(const text_file &)> &read)
{
    TEST_ASSERT_TRUE(survives(valid, read));
    for (std::size_t length = 0; length < valid.size(); ++length) {
        survives(valid.substr(0, length), read);
    }
    random_bytes random{20};
    const std::string telling = "0123456789.,;:=[]{}\"'#$!-+eE%\r\n\t ]x";
    std::size_t read_count = 0;
    for (int round = 0; round < 4000; ++round) {
        std::string text = valid;
        const std::uint32_t changes = 1 + random.next() % 6;
        for (std::uint32_t k = 0; k < changes && !text.empty(); ++k) {
            const std::size_t at = random.next() % text.size();
            switch (random.next() % 5) {
            case 0:
                text[at] = static_cast<char>(random.next() % 256);
                break;
            case 1:
                text[at] = telling[random.next() % telling.size()];
                break;
            case 2:
                text.erase(at, 1 + random.next() % 9);
                break;
            case 3:
                text.insert(at, text.substr(random.next() % text.size(), random.next() % 30));
                break;
            default:
                text.insert(at, 1 + random.next() % 40, telling[random.next() % telling.size()]);
                break;
            }
        }
        read_count += survives(text, read) ? 1U : 0U;
    }
    TEST_ASSERT_TRUE(read_count > 0 && read_count < 4000);
    for (int round = 0; round < 500; ++round) {
        std::string text;
        for (std::uint32_t k = random.next() % 300; k > 0; --k) {
            text += static_cast<char>(random.next() % 256);
        }
        survives(text, read);
    }
}

TEST(scenario_reader_survives)
{
    attack("[scenario]\nduration_s = 60\nseed=7\n[array]\nrows = 1\ncols = 3 ; inline\n"
           "[plant]\neffects = latent_heat,\n    radiation\nx[2] = 0.01\n[chip]\n$a = 1500\n"
           "[noise]\ntemperature_c = 0.3\n[events]\nat 30 = off all\nat 0 = pattern 101\n"
           "at 30 = fail open 3\nat 10 = on 2 50\nat 12 = fan 50\nat 13 = !\n",
           [](const text_file &file) { parse_scenario(file); });
}

} // namespace
