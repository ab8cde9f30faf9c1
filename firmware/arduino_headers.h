/* What it is for: the headers of Arduino libraries, without this project's warnings, which they
 * were not written for. (-isystem does not do: this compiler then takes C++ headers for C.) Only
 * for NINESPRING_SENSOR_ADAFRUIT: nothing else here needs Arduino's core. */
#ifndef ARDUINO_HEADERS_H
#define ARDUINO_HEADERS_H

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#ifndef __cplusplus
#pragma GCC diagnostic ignored "-Wstrict-prototypes"
#endif
#include <Arduino.h>
#ifdef __cplusplus
#include <Adafruit_INA219.h>
#include <Wire.h>
extern "C" {
#include <utility/twi.h>
}
#else
#include <utility/twi.h>
#endif
#pragma GCC diagnostic pop

#endif
