/* What it is for: a pseudo-terminal whose other end any serial terminal opens as if it were a
 * board's port.
 * What it owns: both ends: it keeps the terminal's end open itself, so that clients may come and
 * go.
 * What it never does: wait unless asked to. What no client reads in time is lost, as on a wire. */
#ifndef BOARD_PTY_H
#define BOARD_PTY_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    int master, terminal;
    char name[64];
} board_pty_t;

/* 0, or -1 with errno set. */
int board_pty_open(board_pty_t *pty);
void board_pty_close(board_pty_t *pty);
/* Bytes read, 0 where none are waiting. */
size_t board_pty_read(board_pty_t *pty, uint8_t *bytes, size_t size);
/* Bytes written; the rest is lost. */
size_t board_pty_write(board_pty_t *pty, const uint8_t *bytes, size_t count);
/* Bytes that no client has read yet. */
size_t board_pty_unread(const board_pty_t *pty);
/* Waits until a client has written, a signal has come, or so long, s. */
void board_pty_await(const board_pty_t *pty, double longest_s);

#ifdef __cplusplus
}
#endif
#endif
