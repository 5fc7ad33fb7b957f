# Detector nodes on emulated boards: the same frames to the board, to the Linux node and to one in process, and the same answers. `make test` makes
# a few hundred samples of each board, `make boards` 10 000 in one boot. And a sensor node: its frames are those of the host's sender.

BOARD_NAMES := ctucan zynqmp_r5
board_run = $(WITH_VCAN) -n 2 -t $(3) $(PY) tests/boards/boards_inside.py $(1) $(abspath $(BOARDS)/out) $(2)
sensor_run = $(WITH_VCAN) -t $(3) $(PY) tests/boards/sensor_inside.py $(1) ctucan $(abspath $(BOARDS)/out) $(2)
BOARDS_BUILT := lib apps $(BUILD)/lib/hullguard_f32.i boards-images $(WITH_VCAN)

.PHONY: boards
boards: $(BOARDS_BUILT) ## detector nodes on emulated boards (Cortex-R5F, RISC-V): 10 000 samples in one boot with faulty frames; minutes
	@for b in $(BOARD_NAMES); do PYTHONPATH=host_tools $(call board_run,$$b,10000,1200) || exit 1; done
	@for b in $(BOARD_NAMES); do PYTHONPATH=host_tools $(call sensor_run,$$b,1000,600) || exit 1; done

.PHONY: boards-short
boards-short: $(BOARDS_BUILT)
	@for b in $(BOARD_NAMES); do \
	  PYTHONPATH=host_tools $(call board_run,$$b,300,200) >$(BOARDS)/$$b.log 2>&1 || { cat $(BOARDS)/$$b.log; exit 1; }; \
	  echo "  ok  detector node on board $$b"; done
	@PYTHONPATH=host_tools $(call sensor_run,ctucan,100,100) >$(BOARDS)/sensor.log 2>&1 || { cat $(BOARDS)/sensor.log; exit 1; }
	@echo "  ok  sensor node and detector node on board ctucan"
TEST_PARTS += boards-short

# The contract suite of every HAL on the board itself.
define board_contract
$(BOARDS)/$(1)/o/tests/%.o: BOARD_MORE := -isystem tests/boards/include -Itests/contract
$(call board_image,$(1),contract,tests/contract/contract.c tests/boards/check.c tests/boards/contract_main.c tests/boards/contract_$(1).c)
endef
$(foreach b,$(BOARD_NAMES),$(eval $(call board_contract,$(b))))

.PHONY: boards-contract
boards-contract: boards-images
	@for b in $(BOARD_NAMES); do \
	  PYTHONPATH=host_tools $(PY) tests/boards/contract_run.py $$b >$(BOARDS)/$$b-contract.log 2>&1 || { cat $(BOARDS)/$$b-contract.log; exit 1; }; \
	  echo "  ok  contract on board $$(tail -n 1 $(BOARDS)/$$b-contract.log)"; done
TEST_PARTS += boards-contract

# The same suite on the host, against models of the registers: the drivers as they are for silicon, and errors, which no emulator makes.
MODEL_DRIVER_ctucan := hal/ctucan/ctucan.c
MODEL_DRIVER_zynqmp_r5 := hal/zynqmp_r5/zynqmp_can.c
MODEL_SRC_BOARD := tests/contract/contract.c tests/boards/check.c tests/boards/contract_main.c tests/boards/model_board.c \
                   hal/board/queue.c hal/board/say.c hal/board/controller.c hal/board/board.c
MODEL_FLAGS = -DHG_REGISTERS_MODELLED=1 -Itests/boards/include -Itests/contract -Ihal/board
define board_model
$(eval $(call objects,$(BUILD)/boards/model/$(1)/$(2),$(MODEL_SRC_BOARD) tests/boards/model_$(2).c $(MODEL_DRIVER_$(2)),$$(CC_$(1)) $$(MODEL_FLAGS) -Ihal/$(2)))
$(BUILD)/boards/model/$(1)/$(2)/contract: $(patsubst %.c,$(BUILD)/boards/model/$(1)/$(2)/%.o,$(MODEL_SRC_BOARD) tests/boards/model_$(2).c $(MODEL_DRIVER_$(2)))
	$$(Q)$$(CC_$(1)) -o $$@ $$^
$(BUILD)/boards/model/$(1)/$(2)/contract.ok: $(BUILD)/boards/model/$(1)/$(2)/contract
	@$$(call run_test,$$<,$$<)
boards-contract: $(BUILD)/boards/model/$(1)/$(2)/contract.ok
endef
$(foreach t,$(TOOLSETS),$(foreach b,$(BOARD_NAMES),$(eval $(call board_model,$(t),$(b)))))
