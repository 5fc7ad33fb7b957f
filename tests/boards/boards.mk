# Detector nodes on emulated boards: the same frames to the board, to the Linux node and to one in process, and the same answers; the tests of a node
# on a bus (tests/node/bus_inside.py), which the Linux node passes as well; and a sensor node, whose frames are those of the host's sender. `make check`
# makes a few hundred samples of each board and the quick ones of those tests, `make boards` 10 000 in one boot and all of them.

BOARD_NAMES := ctucan zynqmp_r5
# Memory of the guest: an emulator and three Pythons; with half of it the guest reads its programs from disk again and again.
BOARD_GUEST := 1G
board_run = $(WITH_VCAN) -n 2 -t 1200 $(PY) tests/boards/boards_inside.py $(1) $(abspath $(BOARDS)/out) 10000
sensor_run = $(WITH_VCAN) -t 600 $(PY) tests/boards/sensor_inside.py $(1) ctucan $(abspath $(BOARDS)/out) 1000
node_run = $(WITH_VCAN) -m $(BOARD_GUEST) -n 2 -t 1800 env HULLGUARD_NODES=$(1) $(PY) -m pytest -q --tb=short -p no:cacheprovider -p no:hypothesispytest tests/node/bus_inside.py
BOARDS_BUILT := lib apps $(BUILD)/lib/hullguard_f32.i boards-images $(WITH_VCAN)

.PHONY: boards
boards: boards-node ## detector nodes on emulated boards (Cortex-R5F, RISC-V): 10 000 samples in one boot with faulty frames, the node's tests; minutes
	@for b in $(BOARD_NAMES); do PYTHONPATH=host_tools $(call board_run,$$b) || exit 1; done
	@for b in $(BOARD_NAMES); do PYTHONPATH=host_tools $(call sensor_run,$$b) || exit 1; done

.PHONY: boards-node
boards-node: $(BOARDS_BUILT) ## the tests of a node on a bus, on emulated boards; minutes
	@for b in $(BOARD_NAMES); do PYTHONPATH=host_tools $(call node_run,$$b) || exit 1; done

.PHONY: boards-short
boards-short: $(BOARDS_BUILT)
	@PYTHONPATH=host_tools $(WITH_VCAN) -m $(BOARD_GUEST) -n 2 -t 400 $(PY) tests/boards/short_inside.py $(abspath $(BOARDS)/out) >$(BOARDS)/short.log 2>&1 || { cat $(BOARDS)/short.log; exit 1; }
	@grep '^  ok  ' $(BOARDS)/short.log
	@$(RESULT) $@ 'a detector node on an emulated board answers the frames that the Linux node gets with the same bytes, faulty frames too; a sensor node sends what the host sends' \
	    "$$(grep -c '^  ok  ' $(BOARDS)/short.log) parts on $(words $(BOARD_NAMES)) boards"
CHECK_PARTS += boards-short

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
	@$(RESULT) $@ 'every board passes the suite of the HAL backends: as an image in its emulator, and its driver against a model of the registers, bus errors too' \
	    "$$(for b in $(BOARD_NAMES); do tail -n 1 $(BOARDS)/$$b-contract.log; done | tr '\n' ';' | sed 's/;$$//; s/;/; /g')"
CHECK_PARTS += boards-contract

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
