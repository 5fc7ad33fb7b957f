/** @file
 *  selftest.h: a stored drive through a node. */
#include "any_node.h"

/* A stored drive of any codes that fit, for a node. */
static hg_selftest_config any_drive(void)
{
    hg_selftest_config drive;
    drive.samples = LENGTH;
    drive.code = any_array(int32_t, SIGNALS);
    return drive;
}

/** A self-test makes its steps and ends, on any node that has been started, whatever the node makes of its frames; no alarm is too early where the fault is there
 *  from the first sample on.
 *  LENGTH samples of GROUPS groups; any drive, any node.
 *  @proves hg_selftest_drive
 *  @stub hg_node_receive hg_node_step hg_frame_pack hg_e2e_protect hg_crc32c
 *  @without conversion unsigned-overflow: random numbers are meant to wrap, stamps are cut on purpose
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:34 LENGTH=1U PROTECTION=1U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run deep real=f32 unwind=10 limit=300 hg_e2e_valid.0:34 LENGTH=1U PROTECTION=1U GROUPS=6U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS */
void proof_selftest_drive(void)
{
    const hg_node_config *config = any_node_config();
    hg_node self = any_node(config);
    const hg_selftest_config drive = any_drive();
    hg_selftest_result result;
    assume(requires_selftest(&self, &drive));
    hg_selftest_drive(&self, &drive, &result);
    prove(ensures_selftest_drive(&drive, &result), "an alarm before the fault is one too early");
    if (result.found && (!result.quiet)) {
        reach("an alarm too early");
    }
}

/** A node passes when its alarm came in time and what it computed is what the digest says.
 *  As above.
 *  @proves hg_selftest_run
 *  @stub hg_selftest_drive
 *  @without conversion unsigned-overflow: random numbers are meant to wrap, stamps are cut on purpose
 *  @run check real=f32 unwind=10 limit=90 hg_e2e_valid.0:34 LENGTH=1U PROTECTION=1U GROUPS=2U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS
 *  @run deep real=f32 unwind=10 limit=150 hg_e2e_valid.0:34 LENGTH=1U PROTECTION=1U GROUPS=6U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U ANY_NUMBERS */
void proof_selftest_run(void)
{
    const hg_node_config *config = any_node_config();
    hg_node self = any_node(config);
    const hg_selftest_config drive = any_drive();
    assume(requires_selftest(&self, &drive));
    const hg_status status = hg_selftest_run(&self, &drive);
    prove((status == HG_OK) || (status == HG_E_SELFTEST), "no other status");
    if (status == HG_OK) {
        reach("it passes");
    }
}
