#define _GNU_SOURCE /* posix_openpt, ptsname_r, cfmakeraw */
#include "board_pty.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

static int set_raw(int terminal)
{
    struct termios settings;
    if (tcgetattr(terminal, &settings) != 0) {
        return -1;
    }
    cfmakeraw(&settings);
    (void)cfsetspeed(&settings, B115200);
    return tcsetattr(terminal, TCSANOW, &settings);
}

int board_pty_open(board_pty_t *pty)
{
    pty->terminal = -1;
    pty->master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (pty->master < 0) {
        return -1;
    }
    if (grantpt(pty->master) != 0 || unlockpt(pty->master) != 0 ||
        ptsname_r(pty->master, pty->name, sizeof pty->name) != 0 ||
        (pty->terminal = open(pty->name, O_RDWR | O_NOCTTY | O_CLOEXEC)) < 0 ||
        set_raw(pty->terminal) != 0) {
        int reason = errno;
        board_pty_close(pty);
        errno = reason;
        return -1;
    }
    return 0;
}

void board_pty_close(board_pty_t *pty)
{
    if (pty->terminal >= 0) {
        (void)close(pty->terminal);
    }
    if (pty->master >= 0) {
        (void)close(pty->master);
    }
    pty->terminal = -1;
    pty->master = -1;
}

size_t board_pty_read(board_pty_t *pty, uint8_t *bytes, size_t size)
{
    ssize_t count = read(pty->master, bytes, size);
    return count > 0 ? (size_t)count : 0;
}

size_t board_pty_write(board_pty_t *pty, const uint8_t *bytes, size_t count)
{
    ssize_t written = write(pty->master, bytes, count);
    return written > 0 ? (size_t)written : 0;
}

size_t board_pty_unread(const board_pty_t *pty)
{
    int count = 0;
    return ioctl(pty->terminal, FIONREAD, &count) == 0 && count > 0 ? (size_t)count : 0;
}

void board_pty_await(const board_pty_t *pty, double longest_s)
{
    struct pollfd client = {.fd = pty->master, .events = POLLIN};
    (void)poll(&client, 1, (int)ceil(1e3 * longest_s));
}
