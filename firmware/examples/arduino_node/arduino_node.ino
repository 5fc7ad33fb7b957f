// A detector node in the style of Arduino: copy hullguard.h and hullguard.c of `hullguard amalgam platoon` beside this file.
// Uses the CAN interface of the Arduino core (ArduinoCore-API HardwareCAN, e.g. UNO R4, Portenta): 500 kbit/s.
#include <Arduino_CAN.h>

#include "hullguard.h"

static hg_platoon_node detector;
static const uint32_t period_us = HG_PLATOON_SAMPLE_TIME_US;
static uint32_t closed_us;

static void report()
{
    hg_verdict verdict;
    hg_can_frame answer[2];
    while (hg_node_step(&detector.node, &verdict) == HG_OK) {
        const uint8_t answers = hg_node_report(&detector.node, &verdict, false, answer);
        for (uint8_t i = 0; i < answers; i++) {
            CAN.write(CanMsg(CanStandardId(answer[i].id), answer[i].length, answer[i].data));
        }
        digitalWrite(LED_BUILTIN, (verdict.plant == HG_PLANT_CONFIRMED) ? HIGH : LOW);
    }
}

void setup()
{
    pinMode(LED_BUILTIN, OUTPUT);
    const bool ready = CAN.begin(CanBitRate::BR_500k) && (hg_platoon_node_start(&detector, HG_START_MOVING) == HG_OK);
    while (!ready) {} // no controller, or tables that are not of this library
    closed_us = micros();
}

void loop()
{
    const uint32_t now_us = micros(); // before the frames: one that came in time is not late because this took long
    while (CAN.available() > 0) {
        const CanMsg message = CAN.read();
        hg_can_frame frame = {};
        frame.id = message.getStandardId();
        frame.flags = message.isExtendedId() ? HG_CAN_EXTENDED : 0;
        frame.length = message.data_length;
        for (uint8_t i = 0; i < frame.length; i++) { frame.data[i] = message.data[i]; }
        hg_node_expect(&detector.node, ((micros() - closed_us) / period_us) + 1);
        (void)hg_node_receive(&detector.node, &frame);
        if (detector.node.due > 0) { closed_us = micros(); }
        report();
    }
    if ((int32_t)(now_us - closed_us) > (int32_t)(period_us + (period_us / 2))) {
        hg_node_overdue(&detector.node);
        closed_us += period_us;
        report();
    }
}
