// Stands for what the samples take from Unity: playables, text in the room, XR input. API.md: pages and versions.
using System;
using System.Collections.Generic;

namespace UnityEngine
{
    [AttributeUsage(AttributeTargets.Field)] public sealed class RangeAttribute : Attribute { public RangeAttribute(float min, float max) { } }

    public struct Ray
    {
        public Vector3 origin, direction;
        public Ray(Vector3 origin, Vector3 direction)
        {
            this.origin = origin;
            this.direction = direction;
        }
    }

    public struct Pose
    {
        public Vector3 position;
        public Quaternion rotation;
    }

    public sealed partial class Shader
    {
        /// <summary>Not Unity's: what was set for all shaders.</summary>
        public static readonly Dictionary<string, object> Globals = new Dictionary<string, object>();
        public static Texture GetGlobalTexture(int nameID) { return Global(nameID) as Texture; }
        public static Vector4 GetGlobalVector(int nameID) { return Global(nameID) is Vector4 ? (Vector4)Global(nameID) : new Vector4(); }
        public static void GetGlobalMatrixArray(int nameID, List<Matrix4x4> values)
        {
            values.Clear();
            if (Global(nameID) is Matrix4x4[]) values.AddRange((Matrix4x4[])Global(nameID));
        }
        static object Global(int id)
        {
            object found;
            return Globals.TryGetValue(NameOf(id), out found) ? found : null;
        }
    }

    public sealed partial class Material
    {
        /// <summary>Not Unity's: by name.</summary>
        public readonly Dictionary<string, object> Set = new Dictionary<string, object>();
        public void SetTexture(int nameID, Texture value) { Set[Shader.NameOf(nameID)] = value; }
        public void SetMatrixArray(int nameID, Matrix4x4[] values) { Set[Shader.NameOf(nameID)] = values.Clone(); }
        public void SetVector(int nameID, Vector4 value) { Set[Shader.NameOf(nameID)] = value; }
        public void SetFloat(int nameID, float value) { Set[Shader.NameOf(nameID)] = value; }
    }

    public sealed partial class Mesh
    {
        public Bounds bounds { get; set; }
    }

    public static partial class Graphics
    {
        /// <summary>Not Unity's: material and camera of each mesh that was drawn.</summary>
        public static readonly List<KeyValuePair<Material, Camera>> Drawn = new List<KeyValuePair<Material, Camera>>();
        public static void DrawMesh(Mesh mesh, Matrix4x4 matrix, Material material, int layer, Camera camera) { Drawn.Add(new KeyValuePair<Material, Camera>(material, camera)); }
    }

    public enum TextAnchor { MiddleCenter = 4 }

    public sealed class TextMesh : Component
    {
        public string text { get; set; }
        public float characterSize { get; set; }
        public int fontSize { get; set; }
        public TextAnchor anchor { get; set; }
    }

    public static class SubsystemManager
    {
        /// <summary>Not Unity's: what runs.</summary>
        public static readonly List<object> Running = new List<object>();
        public static void GetSubsystems<T>(List<T> subsystems) { foreach (object one in Running) if (one is T) subsystems.Add((T)one); }
    }
}

namespace UnityEngine.Playables
{
    public struct FrameData { }
    public interface IPlayable { }
    public interface IPlayableBehaviour { }

    /// <summary>Not Unity's: a node of a graph.</summary>
    public sealed class Node
    {
        public readonly List<Node> Inputs = new List<Node>();
        public readonly List<float> Weights = new List<float>();
        public PlayableBehaviour Behaviour;
        public AnimationClip Clip;
        public Node(int inputs)
        {
            for (int i = 0; i < inputs; i++)
            {
                Inputs.Add(null);
                Weights.Add(0);
            }
        }
    }

    public struct Playable : IPlayable
    {
        public Node Node;
    }

    public abstract class PlayableBehaviour : IPlayableBehaviour
    {
        public virtual void ProcessFrame(Playable playable, FrameData info, object playerData) { }
    }

    public abstract class PlayableAsset : ScriptableObject
    {
        public abstract Playable CreatePlayable(PlayableGraph graph, GameObject owner);
    }

    public struct ScriptPlayable<T> : IPlayable where T : PlayableBehaviour, new()
    {
        public Node Node;
        public static ScriptPlayable<T> Create(PlayableGraph graph, int inputCount = 0) { return new ScriptPlayable<T> { Node = new Node(inputCount) { Behaviour = new T() } }; }
        public T GetBehaviour() { return (T)Node.Behaviour; }
        public static implicit operator Playable(ScriptPlayable<T> playable) { return new Playable { Node = playable.Node }; }
        public static explicit operator ScriptPlayable<T>(Playable playable) { return new ScriptPlayable<T> { Node = playable.Node }; }
    }

    public static class PlayableExtensions
    {
        public static int GetInputCount(this Playable playable) { return playable.Node.Inputs.Count; }
        public static Playable GetInput(this Playable playable, int inputPort) { return new Playable { Node = playable.Node.Inputs[inputPort] }; }
        public static float GetInputWeight(this Playable playable, int inputIndex) { return playable.Node.Weights[inputIndex]; }
        public static void SetInputWeight(this Animations.AnimationMixerPlayable playable, int inputIndex, float weight) { playable.Node.Weights[inputIndex] = weight; }
    }

    public static class PlayableOutputExtensions
    {
        public static void SetSourcePlayable(this Animations.AnimationPlayableOutput output, Animations.AnimationMixerPlayable value)
        {
            PlayableGraph.Outputs[output.Target] = value.Node;
        }
    }

    public struct PlayableGraph
    {
        /// <summary>Not Unity's: what each Animator is played by.</summary>
        public static readonly Dictionary<Animator, Node> Outputs = new Dictionary<Animator, Node>();
        bool made;
        public static PlayableGraph Create(string name) { return new PlayableGraph { made = true }; }
        public bool Connect(Animations.AnimationClipPlayable source, int sourceOutputPort, Animations.AnimationMixerPlayable destination, int destinationInputPort)
        {
            destination.Node.Inputs[destinationInputPort] = source.Node;
            return true;
        }
        public bool IsValid() { return made; }
        public void Play() { }
        public void Destroy() { made = false; }
    }
}

namespace UnityEngine.Animations
{
    using UnityEngine.Playables;

    public struct AnimationMixerPlayable
    {
        public Node Node;
        public static AnimationMixerPlayable Create(PlayableGraph graph, int inputCount) { return new AnimationMixerPlayable { Node = new Node(inputCount) }; }
    }

    public struct AnimationClipPlayable
    {
        public Node Node;
        public static AnimationClipPlayable Create(PlayableGraph graph, AnimationClip clip) { return new AnimationClipPlayable { Node = new Node(0) { Clip = clip } }; }
    }

    public struct AnimationPlayableOutput
    {
        public Animator Target;
        public static AnimationPlayableOutput Create(PlayableGraph graph, string name, Animator target) { return new AnimationPlayableOutput { Target = target }; }
    }
}

namespace UnityEngine.XR
{
    public enum XRNode { CenterEye = 2, LeftHand = 4, RightHand = 5 }

    public struct InputFeatureUsage<T>
    {
        public string name { get; set; }
    }

    public static class CommonUsages
    {
        public static InputFeatureUsage<Vector3> centerEyePosition = new InputFeatureUsage<Vector3> { name = "place" };
        public static InputFeatureUsage<Quaternion> centerEyeRotation = new InputFeatureUsage<Quaternion> { name = "turn" };
        public static InputFeatureUsage<Vector3> devicePosition = new InputFeatureUsage<Vector3> { name = "place" };
        public static InputFeatureUsage<Quaternion> deviceRotation = new InputFeatureUsage<Quaternion> { name = "turn" };
    }

    public struct InputDevice
    {
        internal XRNode Node;
        public bool TryGetFeatureValue(InputFeatureUsage<Vector3> usage, out Vector3 value) { return InputDevices.Places.TryGetValue(Node, out value); }
        public bool TryGetFeatureValue(InputFeatureUsage<Quaternion> usage, out Quaternion value)
        {
            value = Quaternion.identity;
            return InputDevices.Places.ContainsKey(Node);
        }
    }

    public static class InputDevices
    {
        /// <summary>Not Unity's: where each device is.</summary>
        public static readonly Dictionary<XRNode, Vector3> Places = new Dictionary<XRNode, Vector3>();
        public static InputDevice GetDeviceAtXRNode(XRNode node) { return new InputDevice { Node = node }; }
    }
}
