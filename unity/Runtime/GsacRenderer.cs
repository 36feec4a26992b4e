using System;
using System.Collections.Generic;
using UnityEngine;

namespace Gsac
{
    /// <summary>
    /// Draws a GsacAvatar, in every render pipeline: skins and binds where the pose changed, for each camera that sees it sorts
    /// where one of them moved, and one indexed draw among the transparent things. All on the GPU: nothing is read back,
    /// nothing is allocated after the first frame.
    /// </summary>
    [AddComponentMenu("Gsac/Gsac Renderer")]
    [DisallowMultipleComponent]
    [DefaultExecutionOrder(10000)]
    [ExecuteAlways]
    public sealed class GsacRenderer : MonoBehaviour
    {
        const int ThreadsPerGroup = 64;
        static readonly int VertexCountId = Shader.PropertyToID("GsacVertexCount");
        static readonly int SplatCountId = Shader.PropertyToID("GsacSplatCount");
        static readonly int RestId = Shader.PropertyToID("GsacRest");
        static readonly int PairsId = Shader.PropertyToID("GsacPairs");
        static readonly int FirstId = Shader.PropertyToID("GsacFirst");
        static readonly int TurnsId = Shader.PropertyToID("GsacTurns");
        static readonly int BentId = Shader.PropertyToID("GsacBent");
        static readonly int SkinId = Shader.PropertyToID("GsacSkin");
        static readonly int MovesId = Shader.PropertyToID("GsacMoves");
        static readonly int WeightsId = Shader.PropertyToID("GsacWeights");
        static readonly int BonesId = Shader.PropertyToID("GsacBones");
        static readonly int PosedId = Shader.PropertyToID("GsacPosed");
        static readonly int CornersId = Shader.PropertyToID("GsacCorners");
        static readonly int LocalId = Shader.PropertyToID("GsacLocal");
        static readonly int SplatsId = Shader.PropertyToID("GsacSplats");
        static readonly int[] LightIds =
        {
            Shader.PropertyToID("GsacLightRed"), Shader.PropertyToID("GsacLightGreen"), Shader.PropertyToID("GsacLightBlue"),
            Shader.PropertyToID("GsacSceneRed"), Shader.PropertyToID("GsacSceneGreen"), Shader.PropertyToID("GsacSceneBlue"),
            Shader.PropertyToID("GsacSceneRed2"), Shader.PropertyToID("GsacSceneGreen2"), Shader.PropertyToID("GsacSceneBlue2"),
            Shader.PropertyToID("GsacSceneLast"),
        };

        [SerializeField, Tooltip("m: where coarser levels of detail begin for a lens of 60 degrees, if the file does not say at which height; each doubling takes the next.")]
        float finestWithin = 8;

        [SerializeField, Tooltip("0..1: how far the avatar stands in the light of the room in which its clip was filmed; 0 is even light.")]
        float clipLight = 1;

        [SerializeField, Tooltip("A material with the shader Gsac/Splats, for a render queue, stencil or depth test of its own; the package's where this is empty.")]
        Material material;

        [SerializeField, Tooltip("Multiplies the colours.")]
        Color tint = Color.white;

        [SerializeField, Tooltip("0..1: how much of the person is there; less fades her by pixels.")]
        float opacity = 1;

        [SerializeField, Tooltip("Whether the scene's fog lies over the person.")]
        bool fog = true;

        [SerializeField, Tooltip("Whether the person casts shadows and writes depth and motion, by the mesh under the gaussians.")]
        bool bodyPass = true;

        [SerializeField, Tooltip("The scene's light, instead of the clip's.")]
        GsacSceneLight sceneLight = new GsacSceneLight();

        [SerializeField, Tooltip("In projects with linear colours: draws the avatar's edges and layers as it was trained, by a picture of its own for each camera, in a headset for each eye.")]
        bool trainedColours = true;

        readonly List<GsacView> views = new List<GsacView>();
        GsacAvatar avatar;
        GsacModel model;
        ComputeShader kernels;
        int correctKernel, skinKernel, bindKernel;
        GraphicsBuffer bones, weights, posed;
        GraphicsBuffer[] splats; // of each level
        GraphicsBuffer turns, bent; // null where the body has no pose correctives
        float[] turnRows;
        Vector4[] boneRows;
        readonly Vector4[] light = new Vector4[10]; // of each of LightIds
        Vector4[] shownBones; // what `shape` stands for
        float[] shownWeights;
        readonly Vector4[] shownLight = new Vector4[10];
        int shape; // counts the poses, weights and lights that were drawn
        int skinned;
        int[] bound; // the shape that each level was bound to
        bool gathered;
        string trouble;

        /// <summary>m: where a lens of 60 degrees begins to see coarser levels of detail, if the file does not say at which height in px.</summary>
        public float FinestWithin
        {
            get { return finestWithin; }
            set { finestWithin = value; }
        }

        /// <summary>0..1: 1 draws the avatar in the light of its clip, 0 evenly lit. The light turns with the avatar's transform, not with its pose.</summary>
        public float ClipLight
        {
            get { return clipLight; }
            set { clipLight = value; }
        }

        /// <summary>A material with the shader Gsac/Splats, for a render queue, stencil or depth test of its own; null: the package's.</summary>
        public Material Material
        {
            get { return material; }
            set { material = value; }
        }

        /// <summary>Multiplies the colours; its alpha counts for nothing.</summary>
        public Color Tint
        {
            get { return tint; }
            set { tint = value; }
        }

        /// <summary>0..1: how much of the person is there. Less fades her by pixels; at 0 she costs nothing.</summary>
        public float Opacity
        {
            get { return opacity; }
            set { opacity = value; }
        }

        /// <summary>Whether the scene's fog lies over the person.</summary>
        public bool Fog
        {
            get { return fog; }
            set { fog = value; }
        }

        /// <summary>
        /// Whether the person casts shadows and writes depth and motion, by the mesh under the gaussians. A material that the child
        /// `Body` has of its own stays.
        /// </summary>
        public bool BodyPass
        {
            get { return bodyPass; }
            set { bodyPass = value; }
        }

        /// <summary>How far the avatar stands in the scene's light, and which that is.</summary>
        public GsacSceneLight SceneLight
        {
            get { return sceneLight; }
        }

        /// <summary>
        /// Whether a project with linear colours shows the trained picture, at the cost of a picture of the avatar's size for each camera,
        /// in a headset for each eye. Off and with a material of its own the splats are blended among the scene's linear colours: paler edges, no more to pay.
        /// </summary>
        public bool TrainedColours
        {
            get { return trainedColours; }
            set { trainedColours = value; }
        }

        void OnEnable()
        {
            Retry();
            GsacCameras.Add(this);
        }

        void OnDisable()
        {
            if (avatar != null) avatar.Dress(false);
            GsacCameras.Remove(this);
            Drop();
        }

        void Drop()
        {
            foreach (GsacView view in views) view.Dispose();
            views.Clear();
            model = null;
            if (bones == null) return;
            bones.Dispose();
            weights.Dispose();
            posed.Dispose();
            foreach (GraphicsBuffer buffer in splats) buffer.Dispose();
            if (bent != null)
            {
                turns.Dispose();
                bent.Dispose();
            }
            bones = turns = bent = null;
        }

        void LateUpdate()
        {
            Refresh();
            if (avatar == null) avatar = GetComponent<GsacAvatar>();
            // one who is off has undressed, and stays closed
            if (avatar != null && avatar.isActiveAndEnabled && avatar.IsOpen) avatar.Dress(bodyPass && opacity > 0);
        }

        /// <summary>
        /// Has the next camera take the joints anew. Each frame does; call it where a script turns joints after that and then
        /// renders a camera by hand.
        /// </summary>
        public void Refresh()
        {
            gathered = false;
        }

        /// <summary>Has the next camera try again what could not be drawn; called where the avatar's file may be another.</summary>
        internal void Retry()
        {
            trouble = null;
        }

        /// <summary>What this camera sees of the avatar, null where that is nothing; called just before the camera culls.</summary>
        internal GsacView See(Camera camera)
        {
            if (avatar == null) avatar = GetComponent<GsacAvatar>();
            if (avatar == null || !avatar.isActiveAndEnabled || !avatar.CanOpen || trouble != null || opacity <= 0) return null;
            try
            {
                if (!Ready()) return null;
            }
            catch (GsacException e)
            {
                Complain(e.Message);
                return null;
            }
            Gather();
            GsacView view = View(camera);
            if (!view.Look(transform, boneRows, model)) return null;
            view.Choose(finestWithin, Finish());
            return view.Level.Count > 0 ? view : null;
        }

        GsacFinish Finish()
        {
            Color shown = QualitySettings.activeColorSpace == ColorSpace.Linear ? tint.linear : tint;
            return new GsacFinish
            {
                Material = material != null ? material : GsacCameras.Material, Tint = new Vector4(shown.r, shown.g, shown.b, Mathf.Clamp(opacity, 0, 1)),
                Trained = trainedColours && material == null, Fog = fog, Layer = gameObject.layer,
            };
        }

        /// <summary>Takes the joints, weights and light of this frame; `shape` counts on where they differ from those before.</summary>
        void Gather()
        {
            // nothing tells that somebody turns a joint in a scene that is edited
            if (gathered && Application.isPlaying) return;
            gathered = true;
            GsacSkeleton.Bones(model.Data, transform, avatar.Joints, boneRows);
            avatar.CollectWeights();
            float lit = model.Data.Light == null ? 0 : Mathf.Clamp(clipLight, 0, 1);
            for (int c = 0; c < 3; c++) light[c] = Light(c, lit);
            sceneLight.Fill(transform, avatar.Joints[0].position, light, 3);
            bool same = GsacKept.Keep(boneRows, shownBones) & GsacKept.Keep(avatar.DrawnWeights, shownWeights) & GsacKept.Keep(light, shownLight);
            if (!same) shape++;
        }

        /// <summary>Buffers of the avatar that is there now. False where this device cannot draw it.</summary>
        bool Ready()
        {
            return model != null && ReferenceEquals(model, avatar.Model) || Prepare();
        }

        bool Prepare()
        {
            if (!SystemInfo.supportsComputeShaders || SystemInfo.maxComputeBufferInputsVertex < 4)
            {
                Complain("this graphics API (" + SystemInfo.graphicsDeviceType + ") has no compute shaders or no buffers in vertex shaders;"
                         + " use Direct3D 11 or 12, Vulkan or Metal");
                return false;
            }
            Drop();
            model = avatar.Model;
            model.Upload();
            int V = model.Data.VertexCount;
            bones = GsacModel.Empty(model.Data.JointCount * 3, 4);
            weights = GsacModel.Empty(model.Data.Expressions.Length, 1);
            posed = GsacModel.Empty(V, 4);
            splats = new GraphicsBuffer[model.Levels.Length];
            for (int n = 0; n < splats.Length; n++) splats[n] = GsacModel.Empty(model.Levels[n].Count * 3, 4);
            boneRows = new Vector4[model.Data.JointCount * 3];
            shownBones = new Vector4[boneRows.Length];
            shownWeights = new float[model.Data.Expressions.Length];
            bound = new int[splats.Length];
            skinned = 0;
            shape = 1;
            gathered = false;
            if (model.Data.Correctives != null)
            {
                turns = GsacModel.Empty(model.Data.JointCount * 3, 4);
                bent = GsacModel.Empty(V, 4);
                turnRows = new float[model.Data.JointCount * 12];
            }
            kernels = Resources.Load<ComputeShader>("Gsac/Gsac");
            correctKernel = kernels.FindKernel("Correct");
            skinKernel = kernels.FindKernel("Skin");
            bindKernel = kernels.FindKernel("Bind");
            return true;
        }

        void Complain(string what)
        {
            trouble = what;
            Debug.LogError(name + ": the avatar cannot be drawn: " + what, this);
        }

        /// <summary>Skins and binds what is not yet of this moment's shape, for the level that the view has chosen.</summary>
        internal void Pose(GsacView view)
        {
            int n = view.LevelNumber;
            if (skinned != shape) Skin();
            if (bound[n] != shape) Bind(view.Level, splats[n]);
            skinned = bound[n] = shape;
            view.Shape = shape;
            view.Splats = splats[n];
        }

        void Skin()
        {
            bones.SetData(boneRows);
            if (avatar.DrawnWeights.Length > 0) weights.SetData(avatar.DrawnWeights);
            kernels.SetInt(VertexCountId, model.Data.VertexCount);
            if (bent != null) Correct();
            kernels.SetBuffer(skinKernel, RestId, bent ?? model.Rest);
            kernels.SetBuffer(skinKernel, SkinId, model.Skin);
            kernels.SetBuffer(skinKernel, MovesId, model.Moves);
            kernels.SetBuffer(skinKernel, WeightsId, weights);
            kernels.SetBuffer(skinKernel, BonesId, bones);
            kernels.SetBuffer(skinKernel, PosedId, posed);
            kernels.Dispatch(skinKernel, Groups(model.Data.VertexCount), 1, 1);
        }

        void Bind(GsacModel.Level level, GraphicsBuffer splats)
        {
            kernels.SetInt(SplatCountId, level.Count);
            for (int i = 0; i < LightIds.Length; i++) kernels.SetVector(LightIds[i], light[i]);
            kernels.SetBuffer(bindKernel, CornersId, level.Corners);
            kernels.SetBuffer(bindKernel, LocalId, level.Local);
            kernels.SetBuffer(bindKernel, PosedId, posed);
            kernels.SetBuffer(bindKernel, SplatsId, splats);
            kernels.Dispatch(bindKernel, Groups(level.Count), 1, 1);
        }

        /// <summary>Fills `bent`: the vertices at rest, as the pose's correctives move them.</summary>
        void Correct()
        {
            for (int j = 0; j < avatar.Joints.Length; j++)
            {
                Quaternion q = avatar.Joints[j].localRotation;
                GsacCorrectives.SetTurn(turnRows, j, q.x, q.y, q.z, q.w);
            }
            turns.SetData(turnRows);
            kernels.SetBuffer(correctKernel, RestId, model.Rest);
            kernels.SetBuffer(correctKernel, PairsId, model.Pairs);
            kernels.SetBuffer(correctKernel, FirstId, model.First);
            kernels.SetBuffer(correctKernel, TurnsId, turns);
            kernels.SetBuffer(correctKernel, BentId, bent);
            kernels.Dispatch(correctKernel, Groups(model.Data.VertexCount), 1, 1);
        }

        /// <summary>A channel's factors of a normal's x, y, |z| and of 1, between even light and the clip's.</summary>
        Vector4 Light(int channel, float lit)
        {
            if (lit == 0) return new Vector4(0, 0, 0, 1);
            float[] light = model.Data.Light;
            return new Vector4(lit * light[3 + channel], lit * light[6 + channel], lit * light[9 + channel], 1 - lit + lit * light[channel]);
        }

        static int Groups(int count)
        {
            return (count + ThreadsPerGroup - 1) / ThreadsPerGroup;
        }

        GsacView View(Camera camera)
        {
            for (int i = views.Count - 1; i >= 0; i--)
            {
                if (views[i].Camera == camera) return views[i];
                if (views[i].Camera != null) continue;
                views[i].Dispose();
                views.RemoveAt(i);
            }
            return NewView(camera);
        }

        GsacView NewView(Camera camera)
        {
            var view = new GsacView(camera, this);
            views.Add(view);
            return view;
        }
    }
}
